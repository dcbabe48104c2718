"""A headless server that speaks the protocol of CARLA 0.9.16 and moves vehicles by our dynamics."""
