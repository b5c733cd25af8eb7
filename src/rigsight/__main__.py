"""How is the command line run as a module, ``python -m rigsight``?"""

from rigsight.cli import main

if __name__ == "__main__":
    main()
