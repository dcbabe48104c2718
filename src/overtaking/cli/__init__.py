"""overtaking.cli"""
