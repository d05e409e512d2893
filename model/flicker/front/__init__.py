"""From a scene and a camera to sorted lists: projection, records, lists; and the float64 reference picture."""
