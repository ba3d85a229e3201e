//! Candidates keep what they promise, and are functions of what is asked.

use vm::world::World as _;

use super::kitchen::Errand;
use crate::motions::tool::ToolWay;
use crate::nav::Place;
use crate::scene::Side;
use crate::search::place::{Item, Wishes, free_poses, stands};
use crate::search::{reach, stand};
use crate::state::{Around, Support};
use crate::world::{Motion, World};

/// Where the base could stand to take an object from a side, and the way of the tool.
fn bases(errand: &Errand, object: &str, side: Side, seed: u64) -> (Vec<Place>, ToolWay, Around) {
    let id = errand.object(object);
    let [reach, lift] = errand.grasp(id, side, &[0]).remove(0);
    let way = ToolWay { arm: 0, vias: reach.vias.into_iter().chain(lift.vias).collect() };
    let near = Around { touchable: vec![id], ..Around::default() };
    let (map, flood) = errand.world.ground().unwrap_or_else(|why| panic!("{}", why.message));
    let ways = [way.clone()];
    let found = stand::to_reach(&errand.world.state, (&map, &flood), &ways, &near, seed);
    (found.unwrap_or_else(|why| panic!("{}", why.message)), way, near)
}

#[test]
fn arms_reach_from_where_they_should() {
    let mut errand = Errand::kitchen("pr2");
    errand.go(&Motion::MovingTorso(0.25));
    let (mut good, mut all) = (0, 0);
    for (object, side) in
        [("cup-1", Side::Front), ("bottle-1", Side::Front), ("plate-1", Side::Top), ("bowl-1", Side::Top)]
    {
        let (places, way, near) = bases(&errand, object, side, 3);
        assert!(places.len() >= 3, "{object}: {}", places.len());
        for place in places {
            let mut fork = errand.world.fork();
            let world = std::mem::take(fork.as_any().downcast_mut::<World>().expect("it is one"));
            let mut tried = Errand { world, now_ns: errand.now_ns, seed: errand.seed };
            tried.try_motion(&Motion::Going(vec![place])).unwrap_or_else(|why| panic!("{object}: {why}"));
            all += 1;
            let ways = [way.clone()];
            good += usize::from(reach::problem(&tried.world.state, None, &ways, &near, 1).is_none());
        }
    }
    // The ways between the via poses were not looked at.
    assert!(good * 10 >= all * 8, "{good} of {all}");
}

#[test]
fn candidates_are_functions_of_what_is_asked() {
    let errand = Errand::kitchen("pr2");
    let first = bases(&errand, "cup-1", Side::Front, 5).0;
    // What was asked before does not matter, nor does it in which fork.
    let _ = bases(&errand, "bottle-1", Side::Front, 5);
    let fork = Errand { world: World::new(errand.world.state.clone()), now_ns: 0, seed: 9 };
    assert_eq!(first, bases(&errand, "cup-1", Side::Front, 5).0);
    assert_eq!(first, bases(&fork, "cup-1", Side::Front, 5).0);
    assert_ne!(first, bases(&errand, "cup-1", Side::Front, 6).0);
}

#[test]
fn nothing_is_free_where_something_stands() {
    let errand = Errand::kitchen("pr2");
    let state = &errand.world.state;
    let scene = &state.setting.scene;
    for (number, surface) in scene.surfaces.iter().enumerate() {
        let support = Support::Surface(crate::scene::SurfaceId(number));
        let mut packed = state.clone();
        // One after another, each object of the kitchen finds a place beside those that came before.
        for (object, _) in scene.objects.iter().enumerate() {
            let id = crate::scene::ObjectId(object);
            let item = Item { kind: scene.kind_of(id), object: Some(id) };
            let found = free_poses(&packed, &item, support, &Wishes::default(), 7);
            for pose in &found {
                assert!(stands(&packed, &item, pose), "{} on {}", scene.objects[object].name, surface.name);
            }
            if let Some(pose) = found.first() {
                packed.put(id, support, pose);
            }
        }
        let most = surface.capacity.unwrap_or(usize::MAX);
        assert!(packed.count_on(support) <= most, "{}", surface.name);
    }
}

#[test]
fn containers_open_from_where_they_should() {
    let mut errand = Errand::kitchen("pr2");
    errand.go(&Motion::MovingTorso(0.25));
    let fridge = errand.world.state.setting.scene.container("fridge").expect("there is one");
    let (map, flood) = errand.world.ground().unwrap_or_else(|why| panic!("{}", why.message));
    let state = &errand.world.state;
    let found = stand::to_open(state, (&map, &flood), (1, fridge, 1.6), 2, 1);
    let found = found.unwrap_or_else(|why| panic!("{}", why.message));
    assert_eq!(found.len(), 2);
    for place in found {
        let why = reach::container_problem(state, Some(place), 1, fridge, 1.6, 1);
        assert!(why.is_none(), "{why:?}");
    }
}
