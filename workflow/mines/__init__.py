"""Mines whose excavations and steps are derived from recorded data: a module for each.

Such a module has `schedule(folder, ...)`, which gives steps and excavations of a mine from the folder of its data
(`excavations_from` in a mine file; its options are the other arguments). longwall.py holds what longwall mines share.
"""
