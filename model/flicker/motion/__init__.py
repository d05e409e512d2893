"""Pictures that move: a camera path through any engine, frame by frame, to a video with figures of every frame (docs/reference/motion.md)."""
