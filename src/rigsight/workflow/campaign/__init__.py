"""Campaigns and models: from files or memory to checked records and the simulation in question; and how a campaign is begun."""
