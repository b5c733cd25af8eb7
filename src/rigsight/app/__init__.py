"""The commands in a browser: pages that show the campaign of a folder and start commands in it; the folder is the only state."""
