"""Uploads: files that arrive in pieces, resumable after a broken connection and after a restart of the server."""

from map3d.uploads.upload_limits import UploadLimits
from map3d.uploads.upload_names import check_path
from map3d.uploads.uploads import ChecksumMismatch, DiskFull, OffsetConflict, Upload, Uploads, UploadWriter, WriteInProgress

__all__ = ["ChecksumMismatch", "DiskFull", "OffsetConflict", "Upload", "UploadLimits", "UploadWriter", "Uploads", "WriteInProgress", "check_path"]
