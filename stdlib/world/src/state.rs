//! The truth: where everything is.
//!
//! A [`State`] is persistent: a clone costs a few counters, and shares all that neither side changes.
//! Poses are kept relative to what carries the thing, so what stands on a tray or in a drawer moves with
//! it without anybody saying so.
//!
//! Invariants
//! 1. What carries an object is no circle: trays do not stand on what stands on them.
//! 2. An object is in a hand exactly if that hand's grip names it.
//! 3. Two states of one world with the same version are equal; [`crate::world::World`] gives numbers out.

use std::sync::Arc;

use im::OrdMap;
use nalgebra::{Isometry3, Vector3};

use crate::robot::collision::{Carried, Obstacles};
use crate::robot::model::{LinkId, VariableId};
use crate::scene::{ContainerId, ObjectId, Surface, SurfaceId};
use crate::setting::{Machine, Setting};

/// Carriers of carriers of carriers: a tray on a tray in a drawer.
const MOST_CARRIERS: usize = 16;

/// The truth about a world.
#[derive(Clone)]
pub struct State {
    /// What does not change.
    pub setting: Arc<Setting>,
    /// Its number in its world.
    pub version: u64,
    /// Pose of the robot's root in the world.
    pub base: Isometry3<f64>,
    /// The robot's configuration.
    pub joints: Arc<[f64]>,
    /// Where each object is.
    pub objects: OrdMap<ObjectId, Place>,
    /// Joints of containers; those that are shut may be left out.
    pub openings: OrdMap<ContainerId, f64>,
    /// What each hand holds, by the number of the arm.
    pub hands: OrdMap<usize, Grip>,
}

/// Where an object is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// What carries it.
    pub on: Support,
    /// From its own frame to that of what carries it.
    pub pose: Isometry3<f64>,
}

/// What carries an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Support {
    /// The floor, or nothing named: poses are in the world.
    Floor,
    /// A surface.
    Surface(SurfaceId),
    /// Another object.
    Object(ObjectId),
    /// The tool of an arm. With two hands, the one of lower number.
    Hand(usize),
}

/// What a hand holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Grip {
    /// An object, and its pose in the frame of the tool.
    Object(ObjectId, Isometry3<f64>),
    /// A container's handle.
    Handle(ContainerId),
}

/// What a question about touching leaves out, or lets hands touch.
#[derive(Debug, Clone, Default)]
pub struct Around {
    /// Objects that the fingers may touch.
    pub touchable: Vec<ObjectId>,
    /// Containers whose moving parts the fingers may touch.
    pub handles: Vec<ContainerId>,
    /// A container that moves: it and what is in it are not around.
    pub moving: Option<ContainerId>,
    /// An object that is looked at by itself: it and what it carries are not around.
    pub without: Option<ObjectId>,
}

impl State {
    /// The beginning of a scene. The robot, if there is one, stands at `base`.
    #[must_use]
    pub fn new(setting: Arc<Setting>, base: Isometry3<f64>) -> State {
        let place = |(number, object): (usize, &crate::scene::Object)| {
            let on = object.on.map_or(Support::Floor, Support::Surface);
            (ObjectId(number), Place { on, pose: object.pose })
        };
        State {
            version: 0,
            base,
            joints: setting.machine.as_ref().map_or_else(|| Vec::new().into(), |it| it.start().into()),
            objects: setting.scene.objects.iter().enumerate().map(place).collect(),
            openings: OrdMap::new(),
            hands: OrdMap::new(),
            setting,
        }
    }

    /// The robot.
    #[must_use]
    pub fn machine(&self) -> Option<&Machine> {
        self.setting.machine.as_deref()
    }

    // ------------------------------------------------------------------ poses

    /// The joint of a container: 0 is shut.
    #[must_use]
    pub fn opening(&self, container: ContainerId) -> f64 {
        self.openings.get(&container).copied().unwrap_or(0.0)
    }

    /// Pose of a surface in the world.
    #[must_use]
    pub fn surface_pose(&self, id: SurfaceId) -> Isometry3<f64> {
        let surface = &self.setting.scene.surfaces[id.0];
        let owner = match surface.moves_with {
            Some(container) => self.setting.container_pose(container, self.opening(container)),
            None => self.setting.scene.fixtures[surface.owner.0].pose,
        };
        owner * surface.pose
    }

    /// Poses of all links in the world.
    #[must_use]
    pub fn links(&self) -> Vec<Isometry3<f64>> {
        let mut poses = Vec::new();
        if let Some(machine) = self.machine() {
            machine.robot.forward(&self.base, &self.joints, &mut poses);
        }
        poses
    }

    /// Pose of an arm's tool in the world.
    #[must_use]
    pub fn tool(&self, arm: usize) -> Isometry3<f64> {
        let chain = self.machine().and_then(|it| Some(&it.limbs.arms.get(arm)?.chain));
        chain.map_or_else(Isometry3::identity, |chain| {
            self.links().get(chain.tip().index()).copied().unwrap_or_default()
        })
    }

    /// Pose of an object in the world.
    #[must_use]
    pub fn object_pose(&self, object: ObjectId) -> Isometry3<f64> {
        let mut pose = Isometry3::identity();
        let mut at = object;
        for _ in 0..MOST_CARRIERS {
            let Some(place) = self.objects.get(&at) else { return pose };
            pose = place.pose * pose;
            match place.on {
                Support::Floor => return pose,
                Support::Surface(surface) => return self.surface_pose(surface) * pose,
                Support::Hand(arm) => return self.tool(arm) * pose,
                Support::Object(below) => at = below,
            }
        }
        pose
    }

    /// What carries an object in the end, with trays passed over.
    #[must_use]
    pub fn ground_of(&self, object: ObjectId) -> Support {
        let mut at = object;
        for _ in 0..MOST_CARRIERS {
            match self.objects.get(&at).map(|place| place.on) {
                Some(Support::Object(below)) => at = below,
                Some(other) => return other,
                None => break,
            }
        }
        Support::Floor
    }

    /// How many objects are below an object, each on the next.
    #[must_use]
    pub fn carriers(&self, object: ObjectId) -> usize {
        let below = |it: &ObjectId| match self.objects.get(it)?.on {
            Support::Object(below) => Some(below),
            _ => None,
        };
        std::iter::successors(below(&object), below).take(MOST_CARRIERS).count()
    }

    /// The object that an object stands on in the end, itself if it stands on none.
    #[must_use]
    pub fn root_of(&self, object: ObjectId) -> ObjectId {
        let mut at = object;
        for _ in 0..MOST_CARRIERS {
            match self.objects.get(&at).map(|place| place.on) {
                Some(Support::Object(below)) => at = below,
                _ => break,
            }
        }
        at
    }

    /// How many objects stand on something.
    #[must_use]
    pub fn count_on(&self, support: Support) -> usize {
        self.objects.values().filter(|place| place.on == support).count()
    }

    /// How many objects a support takes at most; none says that nobody counts.
    #[must_use]
    pub fn capacity(&self, support: Support) -> Option<usize> {
        let scene = &self.setting.scene;
        match support {
            Support::Surface(surface) => scene.surfaces[surface.0].capacity,
            Support::Object(tray) => scene.kind_of(tray).carries.map(|tray| tray.capacity),
            Support::Floor | Support::Hand(_) => None,
        }
    }

    /// The object with what stands on it, itself first.
    #[must_use]
    pub fn with_load(&self, object: ObjectId) -> Vec<ObjectId> {
        let rest = self.objects.keys().filter(|it| **it != object && self.stands_on(**it, object));
        std::iter::once(object).chain(rest.copied()).collect()
    }

    fn stands_on(&self, object: ObjectId, below: ObjectId) -> bool {
        let mut at = object;
        for _ in 0..MOST_CARRIERS {
            match self.objects.get(&at).map(|place| place.on) {
                Some(Support::Object(next)) if next == below => return true,
                Some(Support::Object(next)) => at = next,
                _ => break,
            }
        }
        false
    }

    /// The container that an object is in.
    #[must_use]
    pub fn container_of(&self, object: ObjectId) -> Option<ContainerId> {
        self.surface_below(object).and_then(|it| it.inside)
    }

    /// The surface that an object stands on, in the end.
    fn surface_below(&self, object: ObjectId) -> Option<&Surface> {
        match self.ground_of(object) {
            Support::Surface(surface) => self.setting.scene.surfaces.get(surface.0),
            _ => None,
        }
    }

    // ------------------------------------------------------------------ hands

    /// The object in a hand.
    #[must_use]
    pub fn held(&self, arm: usize) -> Option<ObjectId> {
        match self.hands.get(&arm) {
            Some(Grip::Object(object, _)) => Some(*object),
            _ => None,
        }
    }

    /// The arms that hold an object, in their order.
    #[must_use]
    pub fn holders(&self, object: ObjectId) -> Vec<usize> {
        let holds = |(arm, grip): (&usize, &Grip)| match grip {
            Grip::Object(held, _) if *held == object => Some(*arm),
            _ => None,
        };
        self.hands.iter().filter_map(holds).collect()
    }

    /// Objects in hands with what stands on them, as collision takes them.
    #[must_use]
    pub fn carried(&self) -> Vec<Carried> {
        let Some(machine) = self.machine() else { return Vec::new() };
        let mut carried = Vec::new();
        for (arm, grip) in &self.hands {
            let Grip::Object(object, _) = grip else { continue };
            if self.objects.get(object).is_none_or(|place| place.on != Support::Hand(*arm)) {
                continue; // The first hand has it.
            }
            let holders = self.holders(*object);
            let may_touch =
                holders.iter().flat_map(|arm| fingers(machine, *arm)).copied().collect::<Vec<_>>();
            let link = machine.limbs.arms[*arm].chain.tip();
            let into_tool = self.object_pose(*object).inverse();
            let in_tool = self.objects.get(object).map_or_else(Isometry3::identity, |place| place.pose);
            for each in self.with_load(*object) {
                let pose_in_link = in_tool * (into_tool * self.object_pose(each));
                carried.push(self.as_carried(each, link, pose_in_link, may_touch.clone()));
            }
        }
        carried
    }

    pub(crate) fn as_carried(
        &self,
        object: ObjectId,
        link: LinkId,
        pose_in_link: Isometry3<f64>,
        may_touch: Vec<LinkId>,
    ) -> Carried {
        Carried {
            name: self.setting.scene.objects[object.0].name.clone(),
            link,
            pose_in_link,
            body: self.setting.moving_kinds[self.setting.kind_id(object).0].clone(),
            may_touch,
        }
    }

    // ------------------------------------------------------------------ what stands around

    /// All that the robot can touch: fixtures, containers, and objects that are in no hand.
    #[must_use]
    pub fn obstacles(&self, around: &Around) -> Obstacles {
        let (setting, mut obstacles) = (&self.setting, Obstacles::default());
        let all_fingers: Vec<LinkId> = self.machine().map_or_else(Vec::new, |machine| {
            (0..machine.limbs.arms.len()).flat_map(|arm| fingers(machine, arm)).copied().collect()
        });
        for (fixture, body) in setting.scene.fixtures.iter().zip(&setting.fixtures) {
            obstacles.push(&fixture.name, body, &fixture.pose, &[]);
        }
        let handle = |grip: &Grip| match grip {
            Grip::Handle(container) => Some(*container),
            Grip::Object(..) => None,
        };
        let held_handles: Vec<ContainerId> = self.hands.values().filter_map(handle).collect();
        for (number, body) in setting.containers.iter().enumerate() {
            let id = ContainerId(number);
            if around.moving == Some(id) {
                continue;
            }
            let touchable = around.handles.contains(&id) || held_handles.contains(&id);
            let pose = setting.container_pose(id, self.opening(id));
            obstacles.push(
                &setting.scene.containers[number].name,
                body,
                &pose,
                if touchable { &all_fingers } else { &[] },
            );
        }
        for object in self.objects.keys() {
            let carried = matches!(self.ground_of(*object), Support::Hand(_));
            let moves = around.moving.is_some() && self.drawer_of(*object) == around.moving;
            let left_out = around.without.is_some_and(|it| it == *object || self.stands_on(*object, it));
            if carried || moves || left_out {
                continue;
            }
            let fingers = if around.touchable.contains(object) { &all_fingers[..] } else { &[] };
            let body = &setting.kinds[setting.kind_id(*object).0];
            obstacles.push(&setting.scene.objects[object.0].name, body, &self.object_pose(*object), fingers);
        }
        obstacles
    }

    /// The drawer that an object moves with.
    #[must_use]
    pub fn drawer_of(&self, object: ObjectId) -> Option<ContainerId> {
        self.surface_below(object).and_then(|it| it.moves_with)
    }

    /// The surface right below a point, and how far below: within `reach_m`, objects' trays included.
    /// An object does not carry itself.
    #[must_use]
    pub fn support_below(
        &self,
        point: &Vector3<f64>,
        reach_m: f64,
        object: ObjectId,
    ) -> Option<(Support, f64)> {
        let mut best: Option<(Support, f64)> = None;
        let mut look = |support: Support, pose: Isometry3<f64>, size: [f64; 2]| {
            let local = pose.inverse() * nalgebra::Point3::from(*point);
            let inside = local.x.abs() <= size[0] * 0.5 && local.y.abs() <= size[1] * 0.5;
            let below = local.z;
            if inside && below.abs() <= reach_m && best.is_none_or(|(_, other)| below.abs() < other.abs()) {
                best = Some((support, below));
            }
        };
        for (number, surface) in self.setting.scene.surfaces.iter().enumerate() {
            look(Support::Surface(SurfaceId(number)), self.surface_pose(SurfaceId(number)), surface.size);
        }
        for other in self.objects.keys().filter(|it| **it != object && !self.stands_on(**it, object)) {
            if let Some(tray) = self.setting.scene.kind_of(*other).carries {
                let pose = self.object_pose(*other) * nalgebra::Translation3::from(tray.at);
                look(Support::Object(*other), pose, tray.size);
            }
        }
        best
    }

    /// The frame that poses on a support are given in.
    #[must_use]
    pub fn support_pose(&self, support: Support) -> Isometry3<f64> {
        match support {
            Support::Floor => Isometry3::identity(),
            Support::Surface(surface) => self.surface_pose(surface),
            Support::Object(object) => self.object_pose(object),
            Support::Hand(arm) => self.tool(arm),
        }
    }

    /// What a support is called.
    #[must_use]
    pub fn support_name(&self, support: Support) -> String {
        match support {
            Support::Floor => "floor".into(),
            Support::Surface(surface) => self.setting.surface_name(surface).into(),
            Support::Object(object) => self.setting.scene.objects[object.0].name.clone(),
            Support::Hand(arm) => self
                .machine()
                .and_then(|it| it.limbs.arms.get(arm))
                .map_or_else(String::new, |arm| arm.name.clone()),
        }
    }

    // ------------------------------------------------------------------ changes

    /// Puts numbers into the configuration.
    pub fn set_joints(&mut self, values: &[(VariableId, f64)]) {
        let mut joints = self.joints.to_vec();
        for (variable, value) in values {
            if let Some(place) = joints.get_mut(variable.index()) {
                *place = *value;
            }
        }
        self.joints = joints.into();
    }

    /// As it is when the arms have been parked: those that can go there by themselves.
    #[must_use]
    pub fn parked(&self) -> State {
        let mut state = self.clone();
        let Some(machine) = self.machine() else { return state };
        for (number, arm) in machine.limbs.arms.iter().enumerate() {
            if crate::motions::tool::is_free_to_move(self, number).is_ok() {
                let park = arm.chain.variables().iter().copied().zip(arm.park.iter().copied());
                state.set_joints(&park.collect::<Vec<_>>());
            }
        }
        state
    }

    /// Puts an object somewhere, at a pose in the world, out of all hands.
    pub fn put(&mut self, object: ObjectId, on: Support, pose_in_world: &Isometry3<f64>) {
        for arm in self.holders(object) {
            self.hands.remove(&arm);
        }
        let pose = self.support_pose(on).inverse() * pose_in_world;
        self.objects.insert(object, Place { on, pose });
    }

    /// Puts an object into hands, as they are now; the first is the one that it moves with.
    pub fn take(&mut self, object: ObjectId, arms: &[usize]) {
        let pose = self.object_pose(object);
        let Some(first) = arms.iter().min() else { return };
        for arm in arms {
            self.hands.insert(*arm, Grip::Object(object, self.tool(*arm).inverse() * pose));
        }
        self.objects
            .insert(object, Place { on: Support::Hand(*first), pose: self.tool(*first).inverse() * pose });
    }
}

/// The links of an arm's gripper that may touch what it holds.
pub(crate) fn fingers(machine: &Machine, arm: usize) -> &[LinkId] {
    machine.limbs.arms.get(arm).and_then(|arm| arm.gripper.as_ref()).map_or(&[], |gripper| &gripper.fingers)
}
