"""Object stores opened from a URL: a folder (`file://`), S3, Google Cloud Storage, Azure. Objects have names, bytes and an entity tag."""

from map3d.object_store.contract import ObjectStore, check_object_name
from map3d.object_store.probe import check_conditional_writes
from map3d.object_store.store_url import check_store_url, file_path, join_url, open_object_store

__all__ = ["ObjectStore", "check_conditional_writes", "check_object_name", "check_store_url", "file_path", "join_url", "open_object_store"]
