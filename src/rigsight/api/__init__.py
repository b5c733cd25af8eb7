"""The Python API of the commands: estimators, their results, and functions; exported by `import rigsight`."""
