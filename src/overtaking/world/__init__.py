"""Physics of water, friction, wind and sight, and the constants of each scenario, in float32."""
