// Converts OBJ files to GLB for CesiumJS. Standard input: [{ "obj": …, "glb": …, "mipmaps": boolean }]. After obj2gltf, glTF-Transform (included in 3d-tiles-tools)
// reduces size and draw calls: one palette for plain colours, one mesh per material, WebP with the quality of our tiles, meshopt.
import { readFileSync } from "node:fs";
import { Logger, NodeIO, TextureInfo } from "@gltf-transform/core";
import { ALL_EXTENSIONS } from "@gltf-transform/extensions";
import { dedup, flatten, join, meshopt, palette, prune, textureCompress, weld } from "@gltf-transform/functions";
import { MeshoptEncoder } from "meshoptimizer";
import obj2gltf from "obj2gltf";
import sharp from "sharp";

await MeshoptEncoder.ready;
const io = new NodeIO().registerExtensions(ALL_EXTENSIONS).registerDependencies({ "meshopt.encoder": MeshoptEncoder });
const jobs = JSON.parse(readFileSync(0, "utf8"));
for (const [number, { obj, glb, mipmaps }] of jobs.entries()) {
  const document = await io.readBinary(await obj2gltf(obj, { binary: true, inputUpAxis: "Z", outputUpAxis: "Y", checkTransparency: true }));
  for (const material of document.getRoot().listMaterials()) {
    // Transparent textures are leaves; cut them out, as map3d does.
    if (material.getAlphaMode() === "BLEND") material.setAlphaMode("MASK");
    // obj2gltf does not enable mipmaps.
    if (mipmaps) material.getBaseColorTextureInfo()?.setMinFilter(TextureInfo.MinFilter.LINEAR_MIPMAP_LINEAR);
  }
  document.setLogger(new Logger(Logger.Verbosity.WARN));
  await document.transform(
    dedup(), palette({ min: 2 }), flatten(), join(), weld(), prune(),
    textureCompress({ encoder: sharp, targetFormat: "webp", quality: 80 }),
    meshopt({ encoder: MeshoptEncoder, level: "medium" }),
  );
  await io.write(glb, document);
  const count = document.getRoot().listMeshes().reduce((sum, mesh) => sum + mesh.listPrimitives().length, 0);
  console.error(`bench: ${number + 1} of ${jobs.length}: ${glb}, ${count} primitives`);
}
