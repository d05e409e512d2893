/* Settings of picolibc, of which a few functions are compiled (../build.py): none. */
