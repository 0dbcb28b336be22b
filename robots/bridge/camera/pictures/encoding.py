"""Quality, sizes and rates of the pictures that the camera process encodes. Pure."""

QUALITY = 80  # of JPEG from raw images
SMALL_WIDTH = 320  # pixels
SMALL_QUALITY = 50
VIDEO_WIDTH = 480
VIDEO_HZ = 15
VIDEO_BITS_PER_S = 250_000
VIDEO_KEY_EVERY = 60  # pictures
