"""Uploads a file with tuspy, in a process of its own, because tuspy leaves its files and connections open.

Argument: a JSON document with uploads: the address of all uploads, token, file, checksum, and either stop_at: bytes after which it ends,
or url: of an upload that it resumes. Prints url, start: offset at the start, and offset at the end.
"""

import json
import sys
from pathlib import Path

from tusclient.client import TusClient

asked = json.loads(sys.argv[1])
client = TusClient(asked["uploads"], headers={"Authorization": f"Bearer {asked['token']}"})
metadata = {"filename": Path(asked["file"]).name}
uploader = client.uploader(asked["file"], chunk_size=4_000_000, metadata=metadata, upload_checksum=asked["checksum"], url=asked.get("url"))
start = uploader.offset
uploader.upload(stop_at=asked.get("stop_at"))
print(json.dumps({"url": uploader.url, "start": start, "offset": uploader.offset}))
