/** map3d-cluster: combines markers that are close together. */
export { cluster, cluster as Cluster, type ClusterEvents, type ClusterOptions } from "./cluster";
