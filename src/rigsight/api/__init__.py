"""What the commands do, from Python: estimators, their results, and the functions beside them; `import rigsight` offers it."""
