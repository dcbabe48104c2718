"""overtaking.sim/reference"""
