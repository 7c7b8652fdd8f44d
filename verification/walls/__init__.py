"""Does what breaks depend on where walls lie in their cells?"""
