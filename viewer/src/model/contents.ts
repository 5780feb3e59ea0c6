import { UsageError } from "../map3d";
import type { ThreeClip, ThreeNode } from "./three";

/** A model: what stands in the scene, and how it can move. */
export interface Contents {
  readonly object: ThreeNode;
  readonly clips: readonly ThreeClip[];
}

const isNode = (value: unknown): value is ThreeNode => typeof value === "object" && value !== null && (value as { isObject3D?: unknown }).isObject3D === true;

/** Of an Object3D, or of what GLTFLoader makes: `{ scene, animations }`. @throws UsageError for anything else */
export function contentsOf(made: unknown, name: string): Contents {
  if (isNode(made)) return prepared(made, made.animations);
  const { scene, animations = [] } = (made ?? {}) as { scene?: unknown; animations?: readonly ThreeClip[] };
  if (!isNode(scene)) throw new UsageError(`${name} is neither a three.js Object3D nor { scene, animations }`);
  return prepared(scene, animations);
}

/** A mesh, as far as its belongings can be freed. */
interface Belongings {
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

const materialsOf = ({ material }: Belongings): readonly Material[] => (material ? [material].flat<(Material | readonly Material[])[]>() : []);

/** Does a mesh follow bones, so that its box is not known beforehand? */
export const isBoned = (node: ThreeNode): boolean => (node as Belongings).isSkinnedMesh === true;

function prepared(object: ThreeNode, clips: readonly ThreeClip[]): Contents {
  object.traverse((node) => {
    materialsOf(node as Belongings).forEach(suit);
    if (isBoned(node)) node.frustumCulled = false;
  });
  return { object, clips };
}

function suit(material: Material): void {
  // Glass needs a depth, too: without one it could not be told whether a building stands before it.
  if (material.transparent) material.depthWrite = true;
  // Metal would be black where there is nothing to be mirrored; glTF takes for metal what says nothing of it.
  if (material.metalness && !material.envMap) material.metalness = 0;
}

/** Gives back what the GPU holds of an object; shown again, it is uploaded again. */
export function freed(object: ThreeNode): void {
  object.traverse((node) => {
    const own = node as Belongings;
    own.geometry?.dispose();
    own.skeleton?.dispose();
    if (own.isInstancedMesh) own.dispose?.();
    for (const material of materialsOf(own)) {
      for (const value of Object.values(material) as unknown[]) if ((value as { isTexture?: boolean } | null)?.isTexture) (value as Disposable).dispose();
      material.dispose();
    }
  });
}
