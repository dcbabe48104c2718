"""overtaking.datasets"""
