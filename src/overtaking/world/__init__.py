"""Water, friction and sight: what the weather does to road and eye, in float32."""
