//! Images: textures in mip pages, G-buffers, pyramid reduction, encoding.
