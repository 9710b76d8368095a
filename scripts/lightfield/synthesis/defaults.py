"""What a synthesis does where nothing else is said, apart from `view`, which loads slowly."""

# A picture is made of this many views.
BEST = 6
