"""overtaking.knowledge"""
