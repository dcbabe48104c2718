"""overtaking.physics"""
