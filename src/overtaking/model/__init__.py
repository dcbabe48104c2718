"""overtaking.model"""
