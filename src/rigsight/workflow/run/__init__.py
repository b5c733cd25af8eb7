"""What every run of a command needs: progress, compiled kernels, and files written whole and together or not at all."""
