//! The output arrays of simulations: recorded states, collisions and percepts of the ego.
//!
//! The caller owns the arrays; `Output` borrows them, and each simulation gets its own part. A *slot* is the number
//! of a vehicle in its simulation; the ego is the vehicle under study. A *frame* is a recorded instant. A *percept*
//! records the ego's beliefs about three vehicles at a manoeuvre: the leader, and the leader and the follower in the
//! lane that the ego enters. The slot 255 stands for no vehicle.

/// Largest number of percepts that are recorded in a simulation, chosen; later ones are dropped.
pub const MAX_PERCEPTS: usize = 4;

/// Call a macro with a list of all outputs.
///
/// The list has the arguments of the caller, then each output below with its name, element type and length per
/// simulation (a function of the numbers of slots `v` and frames `t`), then the state fields of shape (vehicle, frame),
/// which `with_states` lists.
#[macro_export]
macro_rules! with_outputs {
    ($callback:ident! { $($arguments:tt)* }) => {
        $crate::with_states! { $callback! {
            { $($arguments)* }
            {
                /// Number of recorded frames.
                num_frames: i32, |_, _| 1;
                /// For each slot, number of frames that may have been written; the state fields of later frames are
                /// zero.
                written: i32, |v, _| v;
                /// Stage of the ego's overtake in each frame.
                stage: u8, |_, t| t;
                /// Slot that the ego has collided with up to each frame; 255 without a collision.
                collided_with: u8, |_, t| t;
                /// Partner in the first collision of each vehicle: its slot, 255 without a collision.
                contact_partner: u8, |v, _| v;
                /// Instant of the first collision [ms].
                contact_time: i32, |v, _| v;
                /// Impulse of the first collision [N s].
                contact_impulse: i32, |v, _| v;
                /// Closing speed of the first collision [mm/s].
                contact_speed: i32, |v, _| v;
                /// 1 if the percept was recorded, else 0.
                percept_valid: u8, |_, _| $crate::MAX_PERCEPTS;
                /// Kind of manoeuvre, a `ManoeuvreKind`: 0 pull out, 1 return, 2 cancel.
                percept_kind: u8, |_, _| $crate::MAX_PERCEPTS;
                /// Instant of the manoeuvre [ms].
                percept_time: i32, |_, _| $crate::MAX_PERCEPTS;
                /// Slots of the three vehicles; 255 for no vehicle.
                percept_slot: u8, |_, _| $crate::MAX_PERCEPTS * 3;
                /// 1 for a vehicle that the ego has detected, else 0.
                percept_is_detected: u8, |_, _| $crate::MAX_PERCEPTS * 3;
                /// Believed gaps [mm].
                percept_gap: i32, |_, _| $crate::MAX_PERCEPTS * 3;
                /// Believed closing speeds [mm/s].
                percept_closing_speed: i32, |_, _| $crate::MAX_PERCEPTS * 3;
                /// True gaps [mm].
                percept_true_gap: i32, |_, _| $crate::MAX_PERCEPTS * 3;
                /// True closing speeds [mm/s].
                percept_true_closing_speed: i32, |_, _| $crate::MAX_PERCEPTS * 3;
                /// Hash over all recorded numbers, 128 bits in four words.
                trace_hash: u32, |_, _| 4;
            }
        } }
    };
}

/// Declare the outputs as a struct of borrowed slices.
macro_rules! output_fields {
    (
        { {} { $($(#[$doc:meta])* $field:ident: $kind:ty, $size:expr;)* } }
        $($(#[$meaning:meta])* $state:ident: $number:ty,)*
    ) => {
        /// The output arrays of a batch of simulations, or of one; the first axis of each array is the simulation.
        pub struct Output<'a> {
            $($(#[$doc])* pub $field: &'a mut [$kind],)*
            $($(#[$meaning])* pub $state: &'a mut [$number],)*
            /// Number of frames that fit into the arrays, a multiple of sixteen.
            pub frames: usize,
            /// Number of vehicle slots of a simulation.
            pub slots: usize,
        }

        impl<'a> Output<'a> {
            /// Name and required length of each array for `batch` simulations.
            pub fn sizes(batch: usize, slots: usize, frames: usize) -> Vec<(&'static str, usize)> {
                vec![
                    $((stringify!($field), batch * $size(slots, frames)),)*
                    $((stringify!($state), batch * slots * frames),)*
                ]
            }

            /// Split the outputs of a batch into one output per simulation.
            pub(crate) fn into_simulations(self) -> Vec<Output<'a>> {
                let (slots, frames) = (self.slots, self.frames);
                let count = self.num_frames.len();
                $(let mut $field = self.$field.chunks_mut($size(slots, frames).max(1));)*
                $(let mut $state = self.$state.chunks_mut((slots * frames).max(1));)*
                // Callers give each array the length of `sizes`, so each simulation has its part.
                let next_simulation = |_| Some(Output {
                    $($field: $field.next()?,)*
                    $($state: $state.next()?,)*
                    slots,
                    frames,
                });
                (0..count).map(next_simulation).collect::<Option<Vec<_>>>().unwrap_or_default()
            }
        }
    };
}

with_outputs! { output_fields! {} }
