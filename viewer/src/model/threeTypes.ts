/** The parts of three.js that are used here. Any build since r155 has them; the page keeps its own three.js types. */
export interface Three {
  readonly REVISION: string;
  readonly LoopOnce: number;
  readonly LoopRepeat: number;
  readonly WebGLRenderer: new (options: { canvas: HTMLCanvasElement; context: WebGL2RenderingContext }) => ThreeRenderer;
  readonly WebGLRenderTarget: new (
    width: number,
    height: number,
    options: { samples: number; colorSpace: "srgb"; depthTexture: never },
  ) => ThreeTarget;
  readonly DepthTexture: new (width: number, height: number) => object;
  readonly Scene: new () => ThreeNode;
  readonly Group: new () => ThreeNode;
  readonly Object3D: new () => ThreeNode;
  readonly OrthographicCamera: new () => ThreeCamera;
  readonly AmbientLight: new () => ThreeLight;
  readonly DirectionalLight: new () => ThreeLight;
  readonly Vector3: new (x: number, y: number, z: number) => ThreeVector;
  readonly Box3: new () => ThreeBox;
  readonly Raycaster: new () => ThreeRaycaster;
  readonly AnimationMixer: new (root: never) => ThreeMixer;
}

export interface ThreeVector {
  readonly x: number;
  readonly y: number;
  readonly z: number;
  set(x: number, y: number, z: number): unknown;
}

/** An Object3D. */
export interface ThreeNode {
  readonly position: ThreeVector;
  readonly rotation: { set(x: number, y: number, z: number, order: "ZYX"): unknown };
  readonly scale: ThreeVector;
  readonly parent: ThreeNode | null;
  readonly animations: readonly ThreeClip[];
  visible: boolean;
  frustumCulled: boolean;
  add(node: ThreeNode): unknown;
  remove(node: ThreeNode): unknown;
  traverse(visit: (node: ThreeNode) => void): void;
}

export interface ThreeLight extends ThreeNode {
  readonly color: { setRGB(r: number, g: number, b: number): unknown };
  intensity: number;
}

/** An AnimationClip. */
export interface ThreeClip {
  readonly name: string;
}

/** An OrthographicCamera. */
export interface ThreeCamera extends ThreeNode {
  left: number;
  right: number;
  top: number;
  bottom: number;
  near: number;
  far: number;
  matrixAutoUpdate: boolean;
  readonly matrix: {
    set(
      ...rows: readonly [
        number,
        number,
        number,
        number,
        number,
        number,
        number,
        number,
        number,
        number,
        number,
        number,
        number,
        number,
        number,
        number,
      ]
    ): unknown;
  };
  updateProjectionMatrix(): void;
}

/** A WebGLRenderTarget. */
export interface ThreeTarget {
  readonly width: number;
  readonly height: number;
  readonly texture: object;
  readonly depthTexture: object | null;
  dispose(): void;
}

/** A WebGLRenderer. */
export interface ThreeRenderer {
  /** Returns `{ __webglTexture }` of a texture that has been rendered to. */
  readonly properties: { get(texture: object): unknown };
  setClearColor(color: number, alpha: number): void;
  setRenderTarget(target: ThreeTarget | null): void;
  render(scene: never, camera: never): void;
  resetState(): void;
  dispose(): void;
}

export interface ThreeBox {
  readonly min: ThreeVector;
  readonly max: ThreeVector;
  setFromObject(node: ThreeNode): unknown;
  isEmpty(): boolean;
}

/** An intersection of a Raycaster. */
export interface ThreeHit {
  readonly object: ThreeNode;
  readonly point: ThreeVector;
}

/** A Raycaster. */
export interface ThreeRaycaster {
  readonly params: { readonly Line: { threshold: number }; readonly Points: { threshold: number } };
  camera: unknown;
  set(origin: ThreeVector, direction: ThreeVector): void;
  intersectObjects(nodes: ThreeNode[], recursive: boolean): readonly ThreeHit[];
}

export interface ThreeMixer {
  clipAction(clip: ThreeClip): ThreeAction;
  update(seconds: number): unknown;
}

export interface ThreeAction {
  clampWhenFinished: boolean;
  reset(): ThreeAction;
  setLoop(mode: never, repetitions: number): ThreeAction;
  play(): ThreeAction;
  stop(): ThreeAction;
  isRunning(): boolean;
}

/** A loader of three.js, such as GLTFLoader. */
export interface ModelLoader {
  /** Returns an Object3D, or `{ scene, animations }`. */
  loadAsync(url: string): Promise<unknown>;
}
