"""Numbers as the hardware has them: formats, functions by table, FP16 and E4M3 operations, thresholds of opacity."""
