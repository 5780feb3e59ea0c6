/** map3d-compare: compares renderings with a swipe divider, a time slider, or maps that move together. */
export { Swipe, Swipe as swipe, type Layers, type SwipeEvents, type SwipeOptions } from "./swipe";
export { Epochs, Epochs as epochs, type Epoch, type EpochsEvents, type EpochsOptions } from "./epochs";
export { Sync, Sync as sync, type SyncEvents, type SyncOptions } from "./sync";
