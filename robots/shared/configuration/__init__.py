"""Values that configure a bridge and a watchdog, and the rules that hold for them on both sides."""
