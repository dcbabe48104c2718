"""Other programs' formats, in and out: OpenDRIVE roads and the tables of the 2023 study."""
