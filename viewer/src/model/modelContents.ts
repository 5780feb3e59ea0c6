import { UsageError } from "../map3d";
import type { ThreeClip, ThreeNode } from "./threeTypes";

/** A model: its root object and its animation clips. */
export interface ModelContents {
  readonly object: ThreeNode;
  readonly clips: readonly ThreeClip[];
}

const isNode = (value: unknown): value is ThreeNode =>
  typeof value === "object" && value !== null && (value as { isObject3D?: unknown }).isObject3D === true;

/** Accepts an Object3D or the result of GLTFLoader, `{ scene, animations }`. @throws UsageError for anything else */
export function readModelContents(source: unknown, name: string): ModelContents {
  if (isNode(source)) return prepared(source, source.animations);
  const { scene, animations = [] } = (source ?? {}) as { scene?: unknown; animations?: readonly ThreeClip[] };
  if (!isNode(scene)) throw new UsageError(`${name} is neither a three.js Object3D nor { scene, animations }`);
  return prepared(scene, animations);
}

/** The resources of a mesh that can be disposed of. */
interface ThreeResources {
  readonly isSkinnedMesh?: boolean;
  readonly isInstancedMesh?: boolean;
  readonly geometry?: Disposable;
  readonly material?: Material | readonly Material[];
  readonly skeleton?: Disposable;
  dispose?(): void;
}

interface Disposable {
  dispose(): void;
}

interface Material extends Disposable {
  readonly transparent: boolean;
  depthWrite: boolean;
  readonly envMap?: unknown;
  metalness?: number;
}

const materialsOf = ({ material }: ThreeResources): readonly Material[] =>
  material ? [material].flat<(Material | readonly Material[])[]>() : [];

/** Is it a skinned mesh, whose bounding box depends on its bones? */
export const isSkinned = (node: ThreeNode): boolean => (node as ThreeResources).isSkinnedMesh === true;

function prepared(object: ThreeNode, clips: readonly ThreeClip[]): ModelContents {
  object.traverse((node) => {
    materialsOf(node as ThreeResources).forEach(adaptMaterial);
    if (isSkinned(node)) node.frustumCulled = false;
  });
  return { object, clips };
}

function adaptMaterial(material: Material): void {
  // Transparent materials need depth, too, so that buildings can hide them.
  if (material.transparent) material.depthWrite = true;
  // Metal without an environment map would be black, and glTF materials are metallic by default.
  if (material.metalness && !material.envMap) material.metalness = 0;
}

/** Frees the GPU resources of an object. three.js uploads them again when the object is drawn again. */
export function disposeGpuResources(object: ThreeNode): void {
  object.traverse((node) => {
    const resources = node as ThreeResources;
    resources.geometry?.dispose();
    resources.skeleton?.dispose();
    if (resources.isInstancedMesh) resources.dispose?.();
    for (const material of materialsOf(resources)) {
      for (const value of Object.values(material) as unknown[])
        if ((value as { isTexture?: boolean } | null)?.isTexture) (value as Disposable).dispose();
      material.dispose();
    }
  });
}
