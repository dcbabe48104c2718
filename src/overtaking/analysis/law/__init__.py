"""What the law says of many overtakes: how it turns on tolerances, and where two laws part."""
