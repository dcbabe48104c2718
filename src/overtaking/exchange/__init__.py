"""overtaking.exchange"""
