"""With what is every model fitted: which records, over which stretch, with which numbers free?"""
