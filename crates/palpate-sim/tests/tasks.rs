//! The tasks of the repository can be simulated as they stand.
#![expect(clippy::unwrap_used, reason = "our own tasks load")]

use palpate_sim::{ContactWorld, SimConfig};
use palpate_spatial::{Pose, UnitQuaternion, Vector3};

const ASSETS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/");

fn sim(task: &str) -> SimConfig {
    let read = |path: String| std::fs::read_to_string(path).unwrap();
    let preset = read(format!("{ASSETS}presets/palpate.toml"));
    let text = format!("{preset}\n{}", read(format!("{ASSETS}tasks/{task}.toml")));
    let table: toml::Table = text.parse().unwrap();
    table["sim"].clone().try_into().unwrap()
}

#[test]
fn every_task_starts_and_can_be_inserted_when_aligned() {
    let tasks = ["peg-insertion", "peg-insertion-sharp", "ring-insertion", "pulley-insertion"];
    let listed = std::fs::read_dir(format!("{ASSETS}tasks")).unwrap();
    let toml = |f: &std::fs::DirEntry| f.path().extension().is_some_and(|e| e == "toml");
    assert_eq!(listed.filter(|f| toml(f.as_ref().unwrap())).count(), tasks.len());
    for task in tasks {
        let config = sim(task);
        let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        let flange = |tip: f64| {
            Pose::from_parts(Vector3::new(0.0, 0.0, tip + config.tool.length).into(), down)
        };
        let mut world = ContactWorld::new(&config, &flange(0.002)).unwrap();
        let mut most = 0.0f64;
        for tick in 0..1000 {
            let tip = (0.002 - 2e-5 * f64::from(tick)).max(-0.012);
            most = most.max(world.tick(&flange(tip), 0.002).unwrap().force.norm());
        }
        // The tool's inertia as it starts to move.
        assert!(most < 2.0, "{task}: {most:.1} N");
        assert!((world.tip_pose().translation.z + 0.012).abs() < 1e-5, "{task}");
        let text = toml::to_string(&config).unwrap();
        assert_eq!(toml::from_str::<SimConfig>(&text).unwrap(), config, "{task}");
    }
}
