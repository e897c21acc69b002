"""Sends a file over and over on a pseudo-terminal, whose path it prints: talk.py FILE"""

import os
import pty
import sys
import time
import tty

ours, theirs = pty.openpty()
tty.setraw(theirs)
print(os.ttyname(theirs), flush=True)
with open(sys.argv[1], "rb") as file:
    data = file.read()
while True:
    os.write(ours, data)
    time.sleep(0.05)
