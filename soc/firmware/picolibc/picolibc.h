/* Settings of picolibc, of which a few functions are compiled (firmware.py): none. */
