"""Parts of the camera process without rospy: headers, lenses, encoding, age of pictures."""
