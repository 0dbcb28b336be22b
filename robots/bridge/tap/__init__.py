"""The tap, without rospy: reads whole messages of topics once for all programs, and encodes each form once."""
