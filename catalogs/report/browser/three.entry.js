// What view.js uses of three.js: README.md says how the bundle is made from this file.
export {
  AmbientLight, BufferAttribute, BufferGeometry, DirectionalLight, DoubleSide, Group, Mesh, MeshLambertMaterial,
  OrthographicCamera, Points, Scene, ShaderMaterial, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
