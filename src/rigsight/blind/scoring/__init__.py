"""What came of trials whose truth is known, one by one and together?"""
