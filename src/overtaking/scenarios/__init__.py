"""overtaking.scenarios"""
