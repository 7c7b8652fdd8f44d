"""Do the stated intervals hold the truth as often as they say, in cases as mines have them?"""
