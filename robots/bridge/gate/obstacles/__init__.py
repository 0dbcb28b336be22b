"""Known obstacles: seen now, remembered, moving, or hidden from the sensors."""
