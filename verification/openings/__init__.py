"""How much do cells of each accuracy leave out around openings of any shape and place?"""
