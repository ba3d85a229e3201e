//! The table of a topic: name, arity, effect and function of each native, once.

/// Makes `natives()` of a topic from its table.
///
/// A row is `"name" [arity] => function;`. The arity is `[2]`, `[1 3]` for one to three, or `[0 ..]`.
/// Most natives need only their arguments and are `fn(&[Value]) -> Result<Value, Raise>`. Those that
/// need more say `in ctx` and are [`vm::native::NativeFn`]; an effect other than `Pure` follows it.
macro_rules! natives {
    ($($name:literal [$($arity:tt)+] $(in $ctx:ident $($effect:ident)?)? => $run:expr;)+) => {
        /// The natives of this topic.
        pub(crate) fn natives() -> Vec<vm::native::Native> {
            vec![$(vm::native::Native {
                name: $name,
                arity: $crate::table::natives!(@arity $($arity)+),
                effect: $crate::table::natives!(@effect $($($effect)?)?),
                run: $crate::table::natives!(@run $run $(, $ctx)?),
            }),+]
        }
    };
    (@arity $n:literal) => { ($n, Some($n)) };
    (@arity $least:literal ..) => { ($least, None) };
    (@arity $least:literal $most:literal) => { ($least, Some($most)) };
    (@effect) => { vm::native::Effect::Pure };
    (@effect $effect:ident) => { vm::native::Effect::$effect };
    (@run $run:expr) => { |_ctx, args| ($run)(args).map(vm::native::Next::Return) };
    (@run $run:expr, $ctx:ident) => { $run };
}
pub(crate) use natives;
