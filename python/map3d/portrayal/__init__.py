"""OGC 3D Portrayal Service 1.0 (OGC 15-001r4): requests, capabilities, views, feature information. Knows nothing of HTTP servers."""
