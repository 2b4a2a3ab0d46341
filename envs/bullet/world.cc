#include "envs/bullet/world.h"

#include "BulletCollision/BroadphaseCollision/btSimpleBroadphase.h"
#include "BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h"
#include "btBulletCollisionCommon.h"

namespace dbr::bullet {
namespace {

constexpr int kMaxColliders = 64;  // in the broadphase; the largest robot has 21 and the floor is one more

bool IsEmpty(const btBroadphaseProxy& proxy) {
  const auto* const collider = static_cast<const btCollisionObject*>(proxy.m_clientObject);
  const btCollisionShape* const shape = collider->getCollisionShape();
  return shape->isCompound() && static_cast<const btCompoundShape*>(shape)->getNumChildShapes() == 0;
}

}  // namespace

// Keeps a pair when either object's mask holds the other's group. If both masks had to match, robots would
// fall through the floor. Refuses pairs with a link without mass: its shape is empty, so they can never
// touch.
class World::PairFilter : public btOverlapFilterCallback {
 public:
  bool needBroadphaseCollision(btBroadphaseProxy* a, btBroadphaseProxy* b) const override {
    const bool wanted = (a->m_collisionFilterGroup & b->m_collisionFilterMask) != 0 ||
                        (b->m_collisionFilterGroup & a->m_collisionFilterMask) != 0;
    return wanted && !IsEmpty(*a) && !IsEmpty(*b);
  }
};

World::World()
    : pair_filter_(std::make_unique<PairFilter>()),
      configuration_(std::make_unique<btDefaultCollisionConfiguration>()),
      dispatcher_(std::make_unique<btCollisionDispatcher>(configuration_.get())),
      broadphase_(std::make_unique<btSimpleBroadphase>(kMaxColliders)),
      solver_(std::make_unique<btMultiBodyConstraintSolver>()),
      world_(std::make_unique<btMultiBodyDynamicsWorld>(dispatcher_.get(), broadphase_.get(), solver_.get(),
                                                        configuration_.get())) {
  broadphase_->getOverlappingPairCache()->setOverlapFilterCallback(pair_filter_.get());
  world_->setGravity(btVector3(0, 0, -9.8));
  world_->setForceUpdateAllAabbs(false);
  // Split islands are necessary: without them, Bullet ignores the joint limits of robots that touch nothing.
  world_->getSimulationIslandManager()->setSplitIslands(true);
  world_->getDispatchInfo().m_deterministicOverlappingPairs = true;
  btContactSolverInfo& solver = world_->getSolverInfo();
  solver.m_numIterations = 5;
  solver.m_erp2 = 0.9;
  solver.m_linearSlop = 1e-5;
  solver.m_leastSquaresResidualThreshold = 1e-7;
  solver.m_minimumSolverBatchSize = 0;
  solver.m_warmstartingFactor = 0.1;
  solver.m_solverMode = SOLVER_USE_WARMSTARTING | SOLVER_USE_2_FRICTION_DIRECTIONS | SOLVER_SIMD;
  AddFloor();
}

World::~World() {
  world_->removeMultiBody(floor_.get());
  world_->removeCollisionObject(floor_collider_.get());
}

void World::AddFloor() {
  floor_shape_ = std::make_unique<btStaticPlaneShape>(btVector3(0, 0, 1), 0);
  floor_shape_->setMargin(0.001);
  floor_ = std::make_unique<btMultiBody>(/*links=*/0, /*mass=*/0, btVector3(0, 0, 0), /*fixed=*/true,
                                         /*can_sleep=*/false);
  floor_collider_ = std::make_unique<btMultiBodyLinkCollider>(floor_.get(), -1);
  floor_collider_->setCollisionShape(floor_shape_.get());
  floor_collider_->setCollisionFlags(btCollisionObject::CF_STATIC_OBJECT);
  floor_collider_->setFriction(0.8);
  floor_collider_->setRestitution(0.5);
  world_->addCollisionObject(floor_collider_.get(), kStaticGroup, kCollidesWithAll ^ kStaticGroup);
  floor_->setBaseCollider(floor_collider_.get());
  floor_->setHasSelfCollision(false);
  floor_->finalizeMultiDof();
  world_->addMultiBody(floor_.get());
}

void World::Step() {
  world_->stepSimulation(kTimeStep, kSubsteps, kTimeStep / kSubsteps);
}

void World::ForgetContacts() {
  for (int i = 0; i < dispatcher_->getNumManifolds(); ++i) {
    dispatcher_->getManifoldByIndexInternal(i)->clearManifold();
  }
}

}  // namespace dbr::bullet
