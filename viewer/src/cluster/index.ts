/** map3d-cluster: combines markers that are close together. */
export { Cluster, Cluster as cluster, type ClusterEvents, type ClusterOptions } from "./cluster";
