"""overtaking.core"""
