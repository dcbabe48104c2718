"""overtaking.tables"""
