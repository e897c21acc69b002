"""Live capture: tshark, through `axle extcap`, on lines that speak while it listens."""
import os
import random
import subprocess
import threading
import time
import tty

import corpora

PATIENCE_S = 30


def captured(user, axle, port, protocol, path, packets):
    """The packets that tshark captures on a port: it ends after this many, or some seconds."""
    command = ["tshark", "-q", "-i", "axle", "-o", f"extcap.axle.port:{port}",
               "-o", f"extcap.axle.protocol:{protocol}", "-c", packets,
               "-a", f"duration:{PATIENCE_S}", "-w", path, "-P", "-T", "fields",
               "-e", "frame.interface_name", "-e", f"axle_{protocol.removesuffix('-3')}.message"]
    extcap = user.home / ".local/lib/wireshark/extcap"
    out = user.run(command, env={"WIRESHARK_EXTCAP_DIR": str(extcap)})
    return [line.split("\t") for line in out.decode().splitlines()]


def of_rover(user, axle, path):
    """The reports of a simulated rover."""
    sim = user.popen([axle, "sim", "ucp", "--for", 2 * PATIENCE_S], stdout=subprocess.PIPE)
    try:
        port = sim.stdout.readline().decode().strip().removeprefix("pty: ")
        return captured(user, axle, port, "ucp", path, 100)
    finally:
        sim.terminate()
        sim.communicate()


def of_bus(user, axle, path):
    """A bus with two nodes whose traffic passes, some of it damaged."""
    master, slave = os.openpty()
    tty.setraw(slave)
    port = os.ttyname(slave)
    os.chmod(port, 0o666)
    # Exclusive use is wanted by the tool.
    os.close(slave)
    is_over, dice = threading.Event(), random.Random(7)

    def speak():
        while not is_over.wait(0.01):
            node = dice.choice((1, 3))
            answer = corpora.rps(0x55, node, dice.uniform(-5, 5)) if node == 1 else \
                corpora.bus(0x56, node, dice.randbytes(4))
            noise = b"\x00" if dice.random() < 0.2 else b""
            os.write(master, corpora.bus(0xAA, node))
            time.sleep(0.002)
            os.write(master, noise + answer)

    speaker = threading.Thread(target=speak)
    speaker.start()
    try:
        return captured(user, axle, port, "ikeya", path, 100)
    finally:
        is_over.set()
        speaker.join()
        os.close(master)
