"""Set-up of all fits: which records, over which stretch, with which parameters free."""
