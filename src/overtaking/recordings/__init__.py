"""Formats of others: reads CommonRoad, highD, exiD, NGSIM, tables and OpenDRIVE, writes several."""
