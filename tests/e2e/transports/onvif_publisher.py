"""An ONVIF camera as WSDiscovery (PyPI) announces it. Arguments: name, hardware, address."""

import sys
import threading
from urllib.parse import quote

from wsdiscovery import QName, Scope
from wsdiscovery.publishing import ThreadedWSPublishing

name, hardware, address = sys.argv[1:]
publisher = ThreadedWSPublishing()
publisher.start()
scopes = [
    Scope(f"onvif://www.onvif.org/name/{quote(name)}"),
    Scope(f"onvif://www.onvif.org/hardware/{quote(hardware)}"),
]
kind = QName("http://www.onvif.org/ver10/network/wsdl", "NetworkVideoTransmitter")
publisher.publishService([kind], scopes, [address])
sys.stdout.write("published\n")
sys.stdout.flush()
threading.Event().wait()
