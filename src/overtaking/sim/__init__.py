"""overtaking.sim"""
