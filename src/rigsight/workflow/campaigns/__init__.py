"""Campaigns: from files or memory to checked records and the simulation in question; and how one is begun."""
